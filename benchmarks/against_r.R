# Recompute the report's numbers in R from an export in CSV.
#
#   Rscript benchmarks/against_r.R EXPORT_DIR OUT.csv
#
# OUT.csv has one number a row: what it is (the first columns of the report's results.csv), its column there, its value.
# EXPORT_DIR/flags.csv has episode, participant and proposal of the report's quality.csv. On Debian, the packages are
# r-cran-lmertest, -pbkrtest, -ordinal, -emmeans, -afex, -car, -effectsize, -clubsandwich, -psych and -rpact.

needed <- c("lmerTest", "pbkrtest", "ordinal", "emmeans", "afex", "car", "effectsize", "clubSandwich", "psych", "rpact")
missing <- needed[!vapply(needed, requireNamespace, logical(1), quietly = TRUE)]
if (length(missing)) {
  message("R has no package ", paste(missing, collapse = ", "), ". The first lines of against_r.R name Debian's.")
  quit(status = 3)
}
suppressPackageStartupMessages({
  library(lmerTest)
  library(ordinal)
  library(emmeans)
  library(afex)
})
afex_options(type = 3)

arguments <- commandArgs(trailingOnly = TRUE)
folder <- arguments[1]
read_table <- function(name) read.csv(
  file.path(folder, "data", sprintf("description-%s_data.csv", name)), na.strings = "", stringsAsFactors = FALSE
)

out <- new.env()
out$rows <- list()
put <- function(section, test, values, layout = "", agent = "", condition = "", contrast = "", question = "") {
  values <- unlist(values)
  values <- values[is.finite(values)]
  if (length(values) == 0) return(invisible())
  out$rows[[length(out$rows) + 1]] <- data.frame(
    section, test, layout, agent, condition, contrast, question, field = names(values), value = unname(values)
  )
}

scripts <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)))
parts <- c("tables", "two_groups", "reward", "mixed_models", "answers", "equivalence", "factors", "primary")
for (part in parts) source(file.path(scripts, "support", "r", paste0(part, ".R")))

rows <- do.call(rbind, out$rows)
rows$value <- sprintf("%.15g", rows$value)
write.csv(rows, arguments[2], row.names = FALSE, quote = TRUE)
used <- c("lme4", "lmerTest", "pbkrtest", "ordinal", "emmeans", "afex", "car", "effectsize", "clubSandwich", "psych",
          "rpact")
versions <- sapply(used, function(name) as.character(packageVersion(name)))
cat(sprintf("R %s.%s", R.version$major, R.version$minor), paste(names(versions), versions), sep = "\n")
