// Written by `python -m server.play.browser_sources`. Do not edit.

declare namespace Wire {
  interface KitchenState {
    t: number;
    players: [number, number, number, number][];
    counters: [number, number, number][];
    pots: [number, number, number, number][];
    score: number;
    soups: number;
  }

  interface Welcome {
    type: "welcome";
    protocol: number;
    episode: string;
    kind: "episode" | "tutorial" | "watch";
    number: number;
    episodes: number;
    layout: string;
    title: string;
    grid: string[];
    seat: number;
    watched_seat: number;
    horizon: number;
    tick_ms: number;
    steps: number;
    shows_predictions: boolean;
    state: KitchenState;
    resumed: boolean;
    endless: boolean;
    partner: "agent" | "human";
    show: "always" | "on_key" | "toggle";
    view_radius: number;
    partner_seen: boolean;
    unknown: [number, number][];
    asked: boolean;
    display: "actions" | "both" | "intention" | "none";
    away_s: number;
  }

  interface Waiting {
    type: "waiting";
    left_s: number;
  }

  interface Countdown {
    type: "countdown";
    seconds: number;
    away_s: number;
  }

  interface Tick {
    type: "tick";
    state: KitchenState;
    prediction: [number, number][];
    actions: [number, number];
    applied: number;
    late: boolean;
    partner_seen: boolean;
    unknown: [number, number][];
    asked: boolean;
    intention: [number, number, number, number];
    pad: string;
  }

  interface Paused {
    type: "paused";
    reason: "blur" | "database" | "hidden" | "lost" | "other_tab" | "partner" | "researcher" | "server";
    left_s: number;
  }

  interface Lesson {
    type: "lesson";
    key: string;
    index: number;
    steps: number;
    done: boolean;
  }

  interface Ended {
    type: "ended";
    score: number;
    soups: number;
    progress: number;
    passed: boolean;
    next: string;
    reason: "away" | "error" | "horizon" | "lessons" | "researcher" | "withdrawn";
  }

  interface Ping {
    type: "ping";
    id: number;
  }

  interface Notice {
    type: "notice";
    text: string;
  }

  interface Refused {
    type: "refused";
    code: "bad_message" | "broken" | "database" | "hello_first" | "no_game" | "not_now" | "protocol";
    reason: string;
  }

  interface Superseded {
    type: "superseded";
  }

  interface Hello {
    type: "hello";
    protocol: number;
    tab: string;
    last_timestep?: number;
  }

  interface Ready {
    type: "ready";
  }

  interface Input {
    type: "input";
    seq: number;
    held: number | null;
    tap: 0 | 1 | 2 | 3 | 5 | null;
    client_ms: number;
    marks?: boolean | null;
  }

  interface Away {
    type: "away";
    reason: "blur" | "hidden";
  }

  interface Pong {
    type: "pong";
    id: number;
  }

  interface ClientError {
    type: "trouble";
    text: string;
  }

  type FromServer =
    | Welcome
    | Waiting
    | Countdown
    | Tick
    | Paused
    | Lesson
    | Ended
    | Ping
    | Notice
    | Refused
    | Superseded;

  type FromBrowser =
    | Hello
    | Ready
    | Input
    | Away
    | Pong
    | ClientError;
}
