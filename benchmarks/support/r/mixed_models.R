# Mixed models of reward, their checks, and simple effects.

contrast_weights <- function(pair, names, prefix = "condition") {
  weights <- setNames(numeric(length(names)), names)
  for (sign in c(1, -1)) {
    name <- paste0(prefix, pair[if (sign == 1) 1 else 2])
    if (name %in% names) weights[name] <- sign
  }
  weights
}
tested <- function(estimate, se, df) {
  half <- qt(0.975, df) * se
  c(estimate = estimate, estimate_low = estimate - half, estimate_high = estimate + half, se = se,
    statistic = estimate / se, df = df, p = 2 * pt(-abs(estimate / se), df))
}
# Satterthwaite's degrees of freedom. Where a variance is 0, lmerTest's are those of a model without people (it takes
# the derivative by a standard deviation, which is 0 there); Kenward and Roger's use the expected information.
contest_of <- function(model, weights) {
  found <- contest(model, weights, joint = FALSE)
  df <- if (isSingular(model)) contest(model, weights, joint = FALSE, ddf = "Kenward-Roger")$df else found$df
  tested(found$Estimate, found$`Std. Error`, df)
}
put_contrasts <- function(model, section, test) for (pair in PAIRS) {
  weights <- contrast_weights(pair, names(fixef(model)))
  put(section, test, contest_of(model, weights), "all", "all", contrast = named(pair))
}
tight <- lmerControl(optimizer = "bobyqa", optCtrl = list(maxfun = 1e5, rhoend = 1e-10), calc.derivs = TRUE)
quiet <- function(expression) suppressMessages(suppressWarnings(expression))
fixed <- reward ~ condition + agent + layout
if (within) {  # the levels that people met in blocks: a difference between orders is that of their means over the levels
  episodes$level <- factor(episodes$factor_prediction)
  contrasts(episodes$level) <- contr.sum(nlevels(episodes$level))
  fixed <- update(fixed, . ~ . + level + condition:level)
}
model <- quiet(lmer(update(fixed, . ~ . + (1 | participant)), episodes, control = tight))
put_contrasts(model, "mixed model", "fixed_effect")
spread <- as.data.frame(VarCorr(model))$sdcor
put("mixed model", "person_sd", c(estimate = if (isSingular(model)) 0 else spread[1]), "all", "all")
put("mixed model", "residual_sd", c(estimate = spread[2]), "all", "all")
put("mixed model", "icc", c(estimate = spread[1]^2 / sum(spread^2)), "all", "all")
small <- quiet(update(model, REML = FALSE))
large <- quiet(update(small, . ~ . + condition:layout))
ratio <- anova(small, large)
put("mixed model", "condition_by_layout", c(statistic = ratio$Chisq[2], df = ratio$Df[2],
  p = ratio$`Pr(>Chisq)`[2]), "all", "all")

plain <- lm(fixed, episodes)
covariance <- quiet(clubSandwich::vcovCR(plain, cluster = episodes$participant, type = "CR2"))
for (pair in PAIRS) {
  weights <- matrix(contrast_weights(pair, names(coef(plain))), 1)
  found <- quiet(clubSandwich::linear_contrast(plain, covariance, contrasts = weights, test = "Satterthwaite"))
  put("robustness", "cluster_robust", tested(found$Est, found$SE, found$df), "all", "all", contrast = named(pair))
}

slopes <- quiet(lmer(update(fixed, . ~ . + (agent | participant)), episodes, control = tight))
for (pair in PAIRS) {
  found <- contest(slopes, contrast_weights(pair, names(fixef(slopes))), joint = FALSE)
  df <- nrow(of_people) - length(CONDITIONS)
  satterthwaite <- c(satterthwaite_df = found$df, satterthwaite_p = found$`Pr(>|t|)`)
  put("robustness", "random_slopes", c(tested(found$Estimate, found$`Std. Error`, df), satterthwaite), "all", "all",
    contrast = named(pair))
}
slope <- attr(VarCorr(slopes)$participant, "stddev")[2]
put("robustness", "slope_sd", c(estimate = unname(slope)), "all", "sp")  # sp against fcp: the same size

episodes$round <- episodes$number - mean(episodes$number)
separable <- function() {
  rank <- function(formula) qr(model.matrix(formula, episodes))$rank
  rank(update(fixed, . ~ . + round)) > rank(fixed)
}
if (separable()) {  # not where all people had layouts and agents in the same order in each block
  with_round <- quiet(lmer(update(fixed, . ~ . + round + (1 | participant)), episodes, control = tight))
  put_contrasts(with_round, "robustness", "with_round")
  # A slope of the round for each person, in units in which the two variances are alike.
  episodes$turn <- episodes$round / sd(episodes$round)
  df <- nrow(of_people) - length(CONDITIONS)
  learning <- quiet(lmer(update(fixed, . ~ . + round + (turn | participant)), episodes, control = tight))
  put_learning <- function(test, model, weights, contrast = "") {
    estimate <- sum(weights * fixef(model))
    se <- sqrt(c(weights %*% as.matrix(vcov(model)) %*% weights))
    put("robustness", test, tested(estimate, se, df), "all", "all", contrast = contrast)
  }
  put_learning("round", learning, as.numeric(names(fixef(learning)) == "round"))
  products <- quiet(update(learning, . ~ . + condition:round))
  for (pair in PAIRS) {
    names <- names(fixef(products))
    weights <- setNames(numeric(length(names)), names)
    for (sign in c(1, -1)) {
      name <- grep(sprintf("^(condition%1$s:round|round:condition%1$s)$", pair[if (sign == 1) 1 else 2]), names)
      weights[name] <- sign
    }
    put_learning("round_by_condition", products, weights, named(pair))
  }
}

if (!within) for (places in list(lapply(LAYOUTS, c, "all"), lapply(AGENTS, function(agent) c("all", agent)))) {
  put_family(lapply(places, function(place) {
    found <- means_of_people(at(episodes, place[1], place[2]))
    list(section = "simple effects", test = "simple_effect", layout = place[1], agent = place[2],
      contrast = named(main), values = student(of(found, main[1]), of(found, main[2])))
  }))
}
