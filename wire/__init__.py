"""What both ends of a link share: frames, signatures, hot payloads, numbers of modes, parameters, ports, wall clock.

Knows no swarm.
"""
