# Tests of two groups, with effect sizes.

varies <- function(...) all(lengths(list(...)) > 1) && any(sapply(list(...), function(x) diff(range(x)) > 0))

# Interval of a standardised difference from the noncentral t distribution, by inversion (Steiger 2004). effectsize has
# the same interval, from a search that stops at four digits.
hedges <- function(first, second, level = 0.95) {
  found <- effectsize::hedges_g(first, second, pooled_sd = TRUE, ci = NULL)
  t <- unname(t.test(first, second, var.equal = TRUE)$statistic)
  df <- length(first) + length(second) - 2
  shift <- sapply(c((1 + level) / 2, (1 - level) / 2), function(tail) {
    uniroot(function(shift) suppressWarnings(pt(t, df, shift)) - tail, t + c(-8, 8), tol = 1e-12)$root
  })
  unbias <- exp(lgamma(df / 2) - lgamma((df - 1) / 2)) / sqrt(df / 2)
  ci <- unbias * shift * sqrt(1 / length(first) + 1 / length(second))
  c(effect = found$Hedges_g, ci_low = ci[1], ci_high = ci[2])
}
# Cliff (1996): the unbiased variance of delta is that of the mean of a two-way table without replication.
cliff <- function(first, second, level = 0.95) {
  d <- sign(outer(round(first, 9), round(second, 9), "-"))
  m <- length(first)
  n <- length(second)
  delta <- mean(d)
  if (abs(delta) == 1) return(c(effect = delta))
  ms <- summary(aov(c(d) ~ factor(row(d)) + factor(col(d))))[[1]][["Mean Sq"]]
  variance <- max((ms[1] + ms[2] - ms[3]) / (m * n), (1 - delta^2) / (m * n - 1))
  z <- qnorm((1 + level) / 2)
  spread <- z * sqrt(variance) * sqrt((1 - delta^2)^2 + z^2 * variance)
  both <- (delta - delta^3 + c(-1, 1) * spread) / (1 - delta^2 + z^2 * variance)
  c(effect = delta, ci_low = max(-1, both[1]), ci_high = min(1, both[2]))
}
student <- function(first, second) {
  test <- t.test(first, second, var.equal = TRUE)
  c(estimate = mean(first) - mean(second), estimate_low = test$conf.int[1], estimate_high = test$conf.int[2],
    se = test$stderr, statistic = unname(test$statistic), df = unname(test$parameter), p = test$p.value,
    hedges(first, second))
}
welch <- function(first, second) {
  test <- t.test(first, second)
  c(estimate = mean(first) - mean(second), statistic = unname(test$statistic), df = unname(test$parameter),
    p = test$p.value, cliff(first, second))
}
# Puts tests of a family, with p adjusted by Benjamini and Hochberg.
put_family <- function(family) {
  family <- Filter(Negate(is.null), family)
  adjusted <- p.adjust(sapply(family, function(one) one$values[["p"]]), "BH")
  for (index in seq_along(family)) {
    one <- family[[index]]
    one$values <- c(one$values, p_adjusted = adjusted[index])
    do.call(put, one)
  }
}
mean_of <- function(values) {
  if (length(values) < 2 || diff(range(values)) == 0) return(c(estimate = mean(values)))
  test <- t.test(values)
  c(estimate = mean(values), estimate_low = test$conf.int[1], estimate_high = test$conf.int[2], se = test$stderr)
}
