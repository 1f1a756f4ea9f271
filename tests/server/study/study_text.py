"""A small study that uses everything, as text, for tests that change a line of it."""

SMALL_STUDY = """\
name: small
title: {en: Small, zh: 小}
summary: {en: A small one, zh: 一个小的}
languages: [en, zh]
seed: 11
duration_min: 4
consent:
  title: {en: Consent, zh: 同意}
  lead: {en: Please read, zh: 请阅读}
  facts:
    - {label: {en: Time, zh: 时间}, value: {en: Four minutes, zh: 四分钟}}
  sections:
    - {title: {en: What, zh: 什么}, body: {en: You *cook*., zh: 你做饭。}}
  boxes:
    - {en: I agree, zh: 我同意}
conditions:
  - {name: without, predictor: none}
  - {name: with, predictor: tom}
agents:
  - {name: planner, predictor: random}
  - {name: stay, predictor: random}
layouts:
  - {name: coordination_ring, title: {en: Ring, zh: 环}}
  - {name: matrix, title: {en: Matrix, zh: 矩阵}}
order: {rule: paper}
game: {horizon: 20, tick_ms: 200}
quiz:
  title: {en: Quiz, zh: 测验}
  attempts: 3
  questions:
    - key: onions
      type: choice
      text: {en: How many onions, zh: 几个洋葱}
      options:
        - {value: two, text: 2}
        - {value: three, text: 3}
      correct: three
questionnaires:
  everything:
    title: {en: Everything, zh: 所有}
    questions:
      - {key: mood, type: scale, text: {en: Mood, zh: 心情}, low: {en: bad, zh: 差}, high: {en: good, zh: 好}}
      - {key: check, type: scale, attention: 2, text: {en: Choose two, zh: 选二}, low: 1, high: 7}
      - key: pick
        type: choice
        text: {en: Pick one, zh: 选一个}
        options: [{value: tea, text: {en: Tea, zh: 茶}}, {value: milk, text: {en: Milk, zh: 奶}}]
      - key: many
        type: multiple
        at_most: 2
        text: {en: Pick some, zh: 选几个}
        options: [{value: a, text: A}, {value: b, text: B}, {value: c, text: C}]
      - {key: words, type: text, max_length: 20, required: false, text: {en: Words, zh: 文字}}
      - {key: years, type: number, minimum: 18, maximum: 99, text: {en: Age, zh: 年龄}}
      - key: rank
        type: ranking
        text: {en: Order them, zh: 排序}
        options: [{value: x, text: X}, {value: y, text: Y}, {value: z, text: Z}]
  after:
    title: {en: How was it, zh: 怎么样}
    questions:
      - {key: partner, type: scale, text: {en: Partner, zh: 伙伴}, low: {en: low, zh: 低}, high: {en: high, zh: 高}}
      - {key: marks, type: scale, conditions: with_predictor, text: {en: Marks, zh: 标记}, low: 1, high: 7}
after_episode: after
breaks: {after: [2]}
pages:
  goodbye: {title: {en: Goodbye, zh: 再见}, body: {en: "Thank **you**. <script>alert(1)</script>", zh: 谢谢}}
flow: [everything, introduction, quiz, tutorial, episodes, goodbye, thanks]
"""
