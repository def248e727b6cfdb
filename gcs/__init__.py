"""The ground station: links, the one loop, the flight, recordings, commands."""
