"""Recordings: every raw frame both ways and our own topics, in one MCAP file."""
