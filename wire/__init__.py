"""What both ends of a link share: frames, hot payloads, mode numbers, connection strings, sockets, wall clock.

Knows no swarm.
"""
