"""Measurements, one process and one run each: `make bench`. Not tests: machines differ, ratios inside one run do not."""
