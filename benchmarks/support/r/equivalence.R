# Equivalence by two one-sided tests.

equivalent <- function(first, second, bound, ...) {
  lower <- t.test(first, second, mu = -bound, alternative = "greater")
  upper <- t.test(first, second, mu = bound, alternative = "less")
  larger <- if (lower$p.value >= upper$p.value) lower else upper
  ci <- t.test(first, second, conf.level = 0.9)$conf.int
  put("equivalence", "equivalence", c(estimate = mean(first) - mean(second), estimate_low = ci[1],
    estimate_high = ci[2], statistic = unname(larger$statistic), df = unname(larger$parameter),
    p = larger$p.value), ...)
  put("equivalence", "difference", welch(first, second), ...)
}
study <- paste(readLines(list.files(file.path(folder, "studies"), full.names = TRUE)), collapse = "\n")
if (grepl("smallest_effect", study)) {
  found <- means_of_people(at(episodes, "clear_division", "all"))
  equivalent(of(found, "tom"), of(found, "none"), 12, "clear_division", "all", contrast = "tom - none")
  if ("random" %in% CONDITIONS) {
    found <- means_of_people(episodes)
    equivalent(of(found, "random"), of(found, "none"), 12, "all", "all", contrast = "random - none")
  }
  found <- means_of_people(about[about$question == "partner_satisfaction", ], "value")
  for (pair in PAIRS) equivalent(of(found, pair[1]), of(found, pair[2]), 0.5, "chosen", "all",
    contrast = named(pair), question = "partner_satisfaction")
}
