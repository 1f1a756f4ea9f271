"""The command line's verbs that make models: thin calls into training."""
