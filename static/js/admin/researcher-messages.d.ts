// What the server sends to the researchers' pages (server/web/admin, server/monitoring).

declare namespace Researcher {
  type Level = 0 | 1 | 2; // calm, warning, urgent
  type Alert = { text: string; path: string; since_s: number }; // `path`: of the game; empty: of none

  /** One running game. */
  interface Card {
    id: string;
    who: string; // of two people, the one who needs attention most
    person: string;
    people: string[]; // all who play
    episode: string;
    agent: string;
    title: string;
    arm: string;
    t: number;
    horizon: number;
    score: number;
    level: Level;
    flag: string;
    since_s: number | null;
    rtt_ms: number | null;
  }

  interface Board {
    state: Wire.KitchenState;
    prediction: [number, number][];
    intention: Wire.Tick['intention'];
    actions: [number, number];
  }

  type Still = Pick<Wire.Welcome, 'grid' | 'seat' | 'watched_seat' | 'tick_ms' | 'horizon'>;

  interface Cards {
    type: 'cards';
    cards: Card[];
    boards: Record<string, Board>;
    still: Record<string, Still>;
  }

  interface Arm {
    name: string;
    kind: string;
    completed: number;
    active: number;
    dropped: number;
    target: number | null;
    simulated: number;
    former: boolean;
  }

  interface FlowNode {
    name: string;
    reached: number;
    here: number;
    lost: Record<string, number>;
    flags?: Record<string, number>;
  }

  interface Person {
    id: string;
    who: string;
    now: string;
    done: number;
    steps: number;
    seen_s: number;
    minutes: number;
    arm: string;
    client_errors: number;
    excluded: boolean;
    quality: { drop?: number; look?: number };
  }

  interface AccuracyRow {
    agent: string;
    layout: string;
    episodes: number;
    steps: number[];
    share: number;
    low: number;
    high: number;
    intention: [number, number, number] | null;
  }

  interface ClientError {
    at: string;
    person: string;
    who: string;
    text: string;
  }

  interface Machine {
    late_ms: [number, number] | null;
    models_ms: [number, number] | null;
    games: number;
    moving: number;
    sockets: number;
    database_mb?: number;
    disk_free_gb?: number;
  }

  /** The dashboard's numbers and tables. */
  interface Figures {
    type: 'figures';
    arms: Arm[];
    flow: FlowNode[];
    accuracy: { rows: AccuracyRow[]; overall: [number, number, number] | null; n: number; waiting: number };
    machine: Machine;
    display: { timesteps: number; games: number; late: number };
    stored: Partial<Record<string, number>>;
    minutes: [number, number, number] | null;
    here: number;
    simulated: number;
    rehearsal: boolean;
    people: Person[];
    client_errors: ClientError[];
    paused: boolean;
    closed: boolean;
  }

  /** The alerts of the server and the study; those of games are on their cards. */
  interface Alerts {
    type: 'alerts';
    alerts: Alert[];
  }

  /** What the dashboard's charts show. */
  interface History {
    machine: { at: number[]; p50_ms: (number | null)[]; p99_ms: (number | null)[] };
    people: { at: number[]; consented: number[]; completed: number[] };
  }

  /** How the newest report of a study goes or went, and which one is kept. */
  interface ReportState {
    stage: string; // empty: none is being made
    failure: string;
    kept: { at: string; by: string; participants: number; simulated: boolean } | null;
    missing: string; // the command that installs what reports need; empty: it is installed
  }

  /** One timestep of a stored or running game. */
  interface Row {
    t: number;
    state: Wire.KitchenState;
    actions: [number, number] | null;
    rewards: [number, number];
    prediction: number[][];
    displayed: [number, number][];
    intentions: { kind: number; x: number; y: number; steps: number; probability: number }[];
    displayed_intention: Wire.Tick['intention'] | null;
    asked: boolean | null;
    misleading: boolean | null;
    keys: [seat: number, seq: number, receivedMs: number][];
    late: boolean;
    late_ms: number;
    models_ms: number;
  }

  interface Input {
    t: number;
    seat: number;
    seq: number;
    held: number | null;
    tap: number | null;
    marks: boolean | null;
    outcome: string;
  }

  interface EpisodeRecord {
    game: Still & { title: string; deadline_ms: number; people?: number };
    rows: Row[];
    inputs: Input[];
    pauses: { t: number; reason: string; duration_ms: number | null; seat: number | null }[];
    accuracy: { share: number; low: number; high: number; n: number }[];
    intention_accuracy: { share: number; low: number; high: number; n: number } | null;
    checked: { equal: boolean; states: number; difference: string };
  }

  type Replay =
    | { type: 'tick'; row: Row; inputs?: Input[] }
    | ({ type: 'status'; phase: string } & Card)
    | { type: 'paused'; by: string | null }
    | { type: 'over' };
}
