"""Component ids that both ends of a link agree on."""

AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""
TRUTH = 200
"""The truth of a simulated vehicle, which only recorder, scorer and report read."""
