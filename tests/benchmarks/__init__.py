"""Measurements, one process and one run each: `make bench`. Machines differ; ratios inside one run hold."""
