# Answers of the questionnaires: means, t-tests, cumulative-link mixed models, scales.

published <- list()
over_people <- list()
for (question in QUESTIONS) for (agent in AGENTS) {
  here <- about[about$question == question & about$agent == agent, ]
  found <- means_of_people(here, "value")
  for (condition in CONDITIONS) {
    put("questionnaire", "mean", mean_of(of(found, condition)), "chosen", agent, condition, question = question)
  }
  for (pair in PAIRS) {
    base <- list(section = "questionnaire", layout = "chosen", agent = agent, contrast = named(pair),
      question = question)
    test <- student(of(here, pair[1]), of(here, pair[2]))
    published[[agent]] <- c(published[[agent]], list(c(base, test = "t_test", values = list(test))))
    test <- student(of(found, pair[1]), of(found, pair[2]))
    over_people <- c(over_people, list(c(base, test = "t_test_people", values = list(test))))
  }
}
for (family in published) put_family(family)
put_family(over_people)

odds <- list()
fixed_of_answers <- answer ~ condition + agent + layout
if (within) fixed_of_answers <- update(fixed_of_answers, . ~ . + level + condition:level)
for (question in QUESTIONS) {
  here <- droplevels(about[about$question == question, ])
  here$answer <- ordered(here$value)
  here$participant <- factor(here$participant)
  if (within) {
    here$level <- factor(here$factor_prediction)
    contrasts(here$level) <- contr.sum(nlevels(here$level))
  }
  model <- tryCatch(
    quiet(clmm(update(fixed_of_answers, . ~ . + (1 | participant)), here, nAGQ = 15, Hess = TRUE,
      control = clmm.control(gradTol = 1e-8))),
    error = function(error) NULL)
  if (is.null(model)) next
  sd <- unname(model$ST[[1]][1])
  if (sd < 1e-3) {  # the variance is 0: clmm has no covariance there, so the model without it
    model <- quiet(clm(fixed_of_answers, data = here, control = clm.control(gradTol = 1e-8)))
  } else put("ordinal", "person_sd", c(estimate = sd), "chosen", "all", question = question)
  covariance <- tryCatch(vcov(model), error = function(error) NULL)
  if (is.null(covariance)) next
  effects <- model$beta
  covariance <- covariance[names(effects), names(effects)]
  df <- nlevels(here$participant) - length(CONDITIONS)
  for (pair in PAIRS) {
    weights <- contrast_weights(pair, names(effects))
    values <- tested(sum(weights * effects), sqrt(c(weights %*% covariance %*% weights)), df)
    values <- c(values, effect = unname(exp(values["estimate"])), ci_low = unname(exp(values["estimate_low"])),
      ci_high = unname(exp(values["estimate_high"])))
    odds[[length(odds) + 1]] <- list(section = "ordinal", test = "odds", layout = "chosen", agent = "all",
      contrast = named(pair), question = question, values = values)
  }
}
if (length(odds) == length(QUESTIONS) * length(PAIRS)) put_family(odds)

# Scales: understanding (reversed items 2 and 4 of 4) and trust (2 items), answered once, points 1 to 5.
scale_items <- list(understanding_predictability = c("tia_up1", "-tia_up2", "tia_up3", "-tia_up4"),
  trust = c("tia_t1", "tia_t2"))
family <- list()
for (name in names(scale_items)) {
  items <- sub("-", "", scale_items[[name]])
  reversed <- startsWith(scale_items[[name]], "-")
  wide <- sapply(items, function(item) {
    mine <- about[about$question == item, ]
    mine$value[match(sort(unique(about$participant)), mine$participant)]
  })
  wide[, reversed] <- 6 - wide[, reversed]
  people <- data.frame(participant = sort(unique(about$participant)), value = rowMeans(wide))
  people$condition <- as.character(of_people$condition[match(people$participant, of_people$participant)])
  people <- people[is.finite(people$value), ]
  question <- paste0("after/trust_in_automation/", name)
  for (condition in CONDITIONS) {
    put("scale", "mean", mean_of(of(people, condition)), condition = condition, question = question)
  }
  complete <- wide[complete.cases(wide), ]
  reliability <- quiet(psych::alpha(complete, warnings = FALSE))
  if (length(items) == 2) {
    put("scale", "spearman_brown", c(estimate = reliability$total$std.alpha), condition = "all", question = question)
  } else {
    put("scale", "alpha", c(estimate = reliability$total$raw_alpha), condition = "all", question = question)
  }
  for (pair in PAIRS) {
    if (!varies(of(people, pair[1]), of(people, pair[2]))) next
    family[[length(family) + 1]] <- list(section = "scale", test = "t_test_people", contrast = named(pair),
      question = question, values = student(of(people, pair[1]), of(people, pair[2])))
  }
}
put_family(family)
