"""YAML → spec → checked graph → plan → drawing. Nothing here runs a stage."""
