# Read the tables of the export.

participants <- read_table("participants")
every <- subset(read_table("episodes"), kind == "episode")
every$participant <- every$participant_0
every$agent <- every$agent_1
every$reward <- every$score + every$progress
every <- merge(every, participants[c("participant", "status", grep("^factor_", names(participants), value = TRUE))],
  by = "participant", suffixes = c("", "_of_person"))
every <- every[order(every$participant, every$number), ]
episodes <- subset(every, status == "done" & status_of_person == "completed")
flags <- read.csv(file.path(folder, "flags.csv"))
LAYOUTS <- intersect(c("coordination_ring", "double_rings", "double_counters", "clear_division"), episodes$layout)
AGENTS <- c("sp", "fcp")
known <- c("none", "random", "tom")
CONDITIONS <- c(intersect(known, episodes$condition), setdiff(unique(participants$condition), known))
for (name in c("layout", "agent", "condition")) {
  levels <- list(layout = LAYOUTS, agent = AGENTS, condition = CONDITIONS)[[name]]
  episodes[[name]] <- factor(episodes[[name]], levels)
}
answers <- read_table("answers")
factor_columns <- grep("^factor_", names(episodes), value = TRUE)
within <- length(factor_columns) == 1
about <- merge(answers[c("episode", "question", "value")],
  episodes[c("episode", "participant", "condition", "layout", "agent", if (within) factor_columns)], by = "episode")
about$value <- as.numeric(about$value)
QUESTIONS <- c("partner_satisfaction", "efficiency")

pairs_of <- function(names) {
  found <- combn(length(names), 2, simplify = FALSE)
  lapply(found, function(two) c(names[two[2]], names[two[1]]))
}
PAIRS <- if (length(CONDITIONS) > 1) pairs_of(CONDITIONS) else list()
named <- function(pair) paste(pair[1], "-", pair[2])

means_of_people <- function(table, value = "reward") {
  if (nrow(table) == 0) return(data.frame(participant = character(), condition = character(), value = numeric()))
  by <- list(participant = table$participant, condition = as.character(table$condition))
  found <- aggregate(table[[value]], by, mean)
  names(found)[3] <- "value"
  found
}
of <- function(means, condition) means$value[means$condition == condition]
at <- function(table, layout, agent) {
  if (layout != "all") table <- table[table$layout == layout, ]
  if (agent != "all") table <- table[table$agent == agent, ]
  table
}
