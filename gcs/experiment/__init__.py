"""Experiments: conditions × arms × seeds, flown on many cores, kept run by run, and put into tables and pictures."""
