"""Simulated vehicles: each flies in JSBSim behind its own MAVLink endpoint."""
