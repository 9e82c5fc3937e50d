"""Executes plans: runner, cache, events, provenance record."""
