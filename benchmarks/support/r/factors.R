# Effects of factors between and within people.

put_effect <- function(f, df1, df2, contrast, question, section = "factorial", test = "anova") {
  ci <- noncentral(f, df1, df2)
  put(section, test, c(statistic = f, df = df1, df_residual = df2, p = pf(f, df1, df2, lower.tail = FALSE),
    effect = f * df1 / (f * df1 + df2), ci_low = ci[1], ci_high = ci[2]), "all", "all", contrast = contrast,
    question = question)
}
crossed <- function(table, value = "reward") {
  found <- means_of_people(table, value)
  found$prediction <- factor(sub("_.*", "", found$condition), c("none", "tom"))
  found$opacity <- factor(sub(".*_", "", found$condition), c("off", "half", "on"))
  list(found = found, model = lm(value ~ prediction * opacity, found))
}
blocks <- function(table, value = "reward") {  # people with all levels
  means <- aggregate(table[[value]], list(participant = table$participant, condition = as.character(table$condition),
    level = factor(table$factor_prediction, c("none", "half", "tom"))), mean)
  means <- droplevels(means)
  whole <- names(which(table(means$participant) == nlevels(means$level)))
  quiet(aov_ez("participant", "x", means[means$participant %in% whole, ], between = "condition", within = "level"))
}
if (length(factor_columns) == 2) {  # between people
  options(contrasts = c("contr.sum", "contr.poly"))
  for (question in c("", QUESTIONS)) {
    both <- if (question == "") crossed(episodes) else crossed(about[about$question == question, ], "value")
    found <- both$found
    model <- both$model
    table <- car::Anova(model, type = 3)
    for (term in c("prediction", "opacity", "prediction:opacity")) {
      put_effect(table[term, "F value"], table[term, "Df"], table["Residuals", "Df"],
        sub(":", " x ", term), question)
    }
    for (name in c("prediction", "opacity")) {
      means <- quiet(as.data.frame(emmeans(model, name)))
      for (index in seq_len(nrow(means))) {
        put("factorial", "marginal_mean", c(estimate = means$emmean[index], se = means$SE[index],
          estimate_low = means$lower.CL[index], estimate_high = means$upper.CL[index]), "all", "all",
          condition = as.character(means[[name]][index]), contrast = name, question = question)
      }
    }
    difference <- quiet(as.data.frame(contrast(emmeans(model, "prediction"), list(tom = c(-1, 1)))))
    put("factorial", "difference", tested(difference$estimate, difference$SE, difference$df), "all", "all",
      contrast = "prediction", question = question)
    simple <- function(levels, name, other) {
      family <- list()
      for (fixed in levels(found[[other]])) for (pair in pairs_of(levels)) {
        here <- found[found[[other]] == fixed, ]
        values <- lapply(pair, function(level) here$value[here[[name]] == level])
        family[[length(family) + 1]] <- list(section = "factorial simple effects", test = "simple_effect",
          layout = "all", agent = "all", condition = paste(other, fixed),
          contrast = sprintf("%s: %s - %s", name, pair[1], pair[2]), question = question,
          values = student(values[[1]], values[[2]]))
      }
      put_family(family)
    }
    simple(c("none", "tom"), "prediction", "opacity")
    simple(c("off", "half", "on"), "opacity", "prediction")
  }
}
if (within) for (question in c("", QUESTIONS)) {  # in two orders
  table <- if (question == "") transform(episodes, value = reward) else
    about[about$question == question, ]
  fitted <- blocks(table, "value")
  row <- fitted$anova_table["level", ]
  put_effect(row$F, row$`num Df`, row$`den Df`, "prediction", question)
  emm <- quiet(as.data.frame(emmeans(fitted, "level")))
  for (index in seq_len(nrow(emm))) put("factorial", "marginal_mean", c(estimate = emm$emmean[index]), "all", "all",
    condition = as.character(emm$level[index]), contrast = "prediction", question = question)
  if (nrow(emm) > 2) {
    found <- quiet(as.data.frame(contrast(emmeans(fitted, "level"), "revpairwise")))
    put_family(lapply(seq_len(nrow(found)), function(index) list(section = "factorial simple effects",
      test = "simple_effect", layout = "all", agent = "all", question = question,
      contrast = paste("prediction:", found$contrast[index]),
      values = tested(found$estimate[index], found$SE[index], found$df[index]))))
    next
  }
  found <- quiet(as.data.frame(contrast(emmeans(fitted, "level"), list(tom = c(-1, 1)))))
  put("factorial", "difference", tested(found$estimate, found$SE, found$df), "all", "all", contrast = "prediction",
    question = question)
}
