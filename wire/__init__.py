"""What both ends of a link share: frames, hot payloads, autopilots' mode numbers, connection strings, sockets, wall clock.

Knows no swarm.
"""
