# Run from here: the workflow itself is in workflow/, so that other workflows can include it.
include: "workflow/Snakefile"


workflow.default_target = "all"
