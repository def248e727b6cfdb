"""Trust-R: trust-aware swarm control as pure functions of numpy arrays. No clock, no socket, no hidden random.

Source of the equations: Y. Pang and R. Liu, "Trust-Aware Emergency Response for A Resilient Human-Swarm
Cooperative System".
"""
