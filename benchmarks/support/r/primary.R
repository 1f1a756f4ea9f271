# The declared primary test, its sensitivity to exclusions, and attrition.

word <- function(key, default) {
  found <- regmatches(study, regexec(sprintf("primary:[^\n]*%s: ([a-z_]+)", key), study))[[1]]
  if (length(found)) found[2] else default
}
many <- function(key) {
  found <- regmatches(study, regexec(sprintf("primary:[^\n]*%s: \\[([a-z0-9_, ]+)\\]", key), study))[[1]]
  if (length(found)) strsplit(found[2], ", ")[[1]] else character()
}
# Boundaries of looks by rpact (Lan-DeMets spending). The present look is the nearest of the declared ones, of two the
# later, and counts with its own number of people; those before it count with the declared numbers.
nominal_level <- function(people, alpha, sided) {
  looks <- as.numeric(many("looks"))
  if (length(looks) == 0) return(alpha)
  planned <- max(looks)
  place <- max(which(abs(looks - people) == min(abs(looks - people))))
  taken <- c(looks[seq_len(place - 1)], people)
  rates <- unique(c(taken / planned, 1))
  kind <- if (word("spending", "obrien_fleming") == "pocock") "asP" else "asOF"
  design <- rpact::getDesignGroupSequential(sided = sided, alpha = alpha, informationRates = rates, typeOfDesign = kind,
    tolerance = 1e-10)
  sided * design$stageLevels[length(taken)]
}
primary <- function(table, source) {
  layouts <- many("layouts")
  agents <- many("agents")
  if (length(layouts)) table <- table[table$layout %in% layouts, ]
  if (length(agents)) table <- table[table$agent %in% agents, ]
  measure <- word("measure", "reward")
  if (measure != "reward") {
    table <- merge(answers[answers$question == measure, c("episode", "value")], table, by = "episode")
    table$reward <- as.numeric(table$value)
  }
  found <- means_of_people(table)
  list(of(found, "tom"), of(found, "none"))
}
declared <- function(groups, people) {
  first <- groups[[1]]
  second <- groups[[2]]
  if (!varies(first, second)) return(NULL)
  direction <- sub("_", ".", word("direction", "two_sided"))
  sided <- if (direction == "two.sided") 2 else 1
  alpha <- nominal_level(people, 0.05, sided)
  level <- 1 - alpha * 2 / sided
  kind <- word("test", "welch")
  if (kind == "mann_whitney") {
    test <- quiet(wilcox.test(first, second, alternative = direction))
    return(c(estimate = median(outer(first, second, "-")), statistic = unname(test$statistic), p = test$p.value,
      cliff(first, second, level), ci_level = level))
  }
  test <- t.test(first, second, alternative = direction, var.equal = kind == "student")
  ci <- t.test(first, second, var.equal = kind == "student", conf.level = level)$conf.int
  c(estimate = mean(first) - mean(second), estimate_low = ci[1], estimate_high = ci[2], se = test$stderr,
    statistic = unname(test$statistic), df = unname(test$parameter), p = test$p.value, hedges(first, second, level),
    ci_level = level)
}
settled <- participants[participants$status != "active", ]
finished <- every[every$status == "done", ]
dropped <- flags$participant[flags$proposal == "drop" & flags$episode %in% episodes$episode]
flagged <- flags$participant[flags$proposal != "keep" & flags$episode %in% episodes$episode]
tables <- list(
  analysed = episodes, assigned = finished, completed = finished[finished$status_of_person == "completed", ],
  no_drop = episodes[!episodes$participant %in% dropped, ], no_flag = episodes[!episodes$participant %in% flagged, ])
put_declared <- function(section, test, table) {
  if (within) {
    row <- tryCatch(blocks(table)$anova_table["level", ], error = function(error) NULL)
    if (is.null(row) || row$`den Df` == 0) return()
    if (row$`num Df` != 1) return(put_effect(row$F, row$`num Df`, row$`den Df`, "prediction", "", section, test))
    return(put(section, test, c(statistic = sqrt(row$F), df = row$`den Df`, p = row$`Pr(>F)`), "all", "all",
      contrast = "prediction"))  # the difference is positive
  }
  if (length(factor_columns)) {
    if (length(unique(table$condition)) < 6) return()
    row <- car::Anova(crossed(table)$model, type = 3)
    return(put_effect(row["prediction:opacity", "F value"], 2, row["Residuals", "Df"], "prediction x opacity", "",
      section, test))
  }
  one <- function(names) if (length(names) == 1) names else if (length(names)) "chosen" else "all"
  question <- if (word("measure", "reward") == "reward") "" else word("measure", "")
  put(section, test, declared(primary(table), sum(lengths(primary(episodes)))), one(many("layouts")),
    one(many("agents")), contrast = "tom - none", question = question)
}
put_declared("primary", if (length(factor_columns)) "anova" else word("test", "welch"), episodes)
for (name in names(tables)) put_declared("sensitivity", name, tables[[name]])

for (kind in c("left", "not_analysed")) {
  lost <- if (kind == "left") settled$status != "completed" else !settled$participant %in% episodes$participant
  counts <- table(factor(settled$condition, CONDITIONS), lost)
  for (condition in CONDITIONS) {
    put("attrition", kind, c(estimate = mean(lost[settled$condition == condition])), condition = condition)
  }
  if (length(unique(lost)) < 2) next
  expected <- quiet(chisq.test(counts, correct = FALSE))
  put("attrition", paste0(kind, "_by_condition"), if (min(expected$expected) >= 5) {
    c(statistic = unname(expected$statistic), df = unname(expected$parameter), p = expected$p.value)
  } else if (nrow(counts) == 2) c(p = fisher.test(counts)$p.value) else c(monte_carlo_p = fisher.test(counts)$p.value))
}
