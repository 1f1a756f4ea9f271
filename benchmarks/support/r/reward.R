# Reward: means, analyses of variance, assumptions, ranks, t-tests, permutations.

for (layout in c(LAYOUTS, "all")) for (agent in AGENTS) {
  found <- means_of_people(at(episodes, layout, agent))
  for (condition in CONDITIONS) {
    put("reward", "mean", mean_of(of(found, condition)), layout, agent, condition)
  }
}

eta <- function(model) {
  found <- effectsize::eta_squared(model, partial = FALSE, ci = NULL)
  found$Eta2[1]
}
# Interval of a share of variance from the noncentral F distribution, by inversion (Steiger 2004).
noncentral <- function(f, df1, df2, level = 0.90) {
  solve_for <- function(tail) {
    if (pf(f, df1, df2) <= tail) return(0)
    uniroot(function(shift) pf(f, df1, df2, shift) - tail, c(0, 1000), tol = 1e-12)$root
  }
  shift <- sapply(c((1 + level) / 2, (1 - level) / 2), solve_for)
  shift / (shift + df1 + df2 + 1)
}
anova_of <- function(values, groups) {
  model <- aov(values ~ factor(groups))
  test <- summary(model)[[1]]
  ci <- noncentral(test[1, "F value"], test[1, "Df"], test[2, "Df"])
  c(statistic = test[1, "F value"], df = test[1, "Df"], df_residual = test[2, "Df"], p = test[1, "Pr(>F)"],
    effect = eta(model), ci_low = ci[1], ci_high = ci[2])
}
for (layout in LAYOUTS) for (agent in c(AGENTS, "all")) {
  here <- at(episodes, layout, agent)
  put("reward", "anova", anova_of(here$reward, here$condition), layout, agent)
  oneway <- oneway.test(reward ~ condition, droplevels(here))
  put("reward", "welch_anova", c(statistic = unname(oneway$statistic), df = unname(oneway$parameter[1]),
    df_residual = unname(oneway$parameter[2]), p = oneway$p.value), layout, agent)
  people <- means_of_people(here)
  put("reward", "anova_people", anova_of(people$value, people$condition), layout, agent)
  if (agent == "all") next
  enough <- names(which(table(here$condition) > 2))  # the report leaves out smaller conditions, and says so
  rest <- residuals(lm(reward ~ condition, droplevels(here[here$condition %in% enough, ])))
  shapiro <- shapiro.test(rest)
  put("assumptions", "shapiro_wilk", c(statistic = unname(shapiro$statistic), p = shapiro$p.value), layout, agent)
  levene <- car::leveneTest(reward ~ condition, droplevels(here[here$condition %in% enough, ]), center = median)
  put("assumptions", "levene", c(statistic = levene[1, "F value"], df = levene[1, "Df"],
    df_residual = levene[2, "Df"], p = levene[1, "Pr(>F)"]), layout, agent)
}

for (agent in AGENTS) {
  here <- at(episodes, "all", agent)
  test <- kruskal.test(reward ~ condition, droplevels(here))
  effect <- effectsize::rank_epsilon_squared(reward ~ condition, data = droplevels(here), ci = NULL)[[1]]
  put("reward", "kruskal_wallis", c(statistic = unname(test$statistic), df = unname(test$parameter),
    p = test$p.value, effect = effect), "all", agent)
}

two_groups <- list(
  t_test = list(people = FALSE, test = student), t_test_people = list(people = TRUE, test = student),
  welch_t_test = list(people = TRUE, test = welch)
)
for (pair in PAIRS) for (kind in names(two_groups)) {
  family <- list()
  for (layout in LAYOUTS) for (agent in AGENTS) {
    here <- at(episodes, layout, agent)
    if (two_groups[[kind]]$people) here <- means_of_people(here) else here$value <- here$reward
    first <- of(here, pair[1])
    second <- of(here, pair[2])
    if (!varies(first, second)) next
    family[[length(family) + 1]] <- list(section = "reward", test = kind, layout = layout, agent = agent,
      contrast = named(pair), values = two_groups[[kind]]$test(first, second))
  }
  put_family(family)
}

# Conditions permuted over people, 5000 draws. Kruskal-Wallis and whether the main contrast depends on the layout.
set.seed(1)
DRAWS <- 5000
permuted <- function(labels, statistic) {
  observed <- statistic(labels)
  drawn <- replicate(DRAWS, statistic(sample(labels)))
  (1 + sum(drawn >= observed - 1e-9 * max(1, abs(observed)))) / (DRAWS + 1)
}
of_people <- unique(episodes[c("participant", "condition")])
of_people$condition <- as.character(of_people$condition)
for (agent in AGENTS) {
  here <- at(episodes, "all", agent)
  ranks <- rank(here$reward)
  person <- factor(here$participant, of_people$participant)
  sums <- tapply(ranks, person, sum, default = 0)
  counts <- tapply(ranks, person, length, default = 0)
  put("reward", "kruskal_wallis_people", c(monte_carlo_p = permuted(of_people$condition, function(labels) {
    sum(tapply(sums, labels, sum)^2 / tapply(counts, labels, sum))
  })), "all", agent)
}
main <- if (all(c("tom", "none") %in% CONDITIONS)) c("tom", "none") else CONDITIONS[c(length(CONDITIONS), 1)]
if (!within) for (column in c("layout", "agent")) {
  here <- droplevels(episodes[episodes$condition %in% main, ])
  here$rest <- residuals(lm(reward ~ layout * agent + participant, here))
  labels <- of_people$condition[match(levels(factor(here$participant)), of_people$participant)]
  sums <- tapply(here$rest, list(here$participant, here[[column]]), sum, default = 0)
  counts <- tapply(here$rest, list(here$participant, here[[column]]), length, default = 0)
  put("reward", paste0("contrast_by_", column), c(monte_carlo_p = permuted(labels, function(labels) {
    sum(rowsum(sums, labels)^2 / rowsum(counts, labels))
  })), "all", "all", contrast = named(main))
}
