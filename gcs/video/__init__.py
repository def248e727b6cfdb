"""A flight as a film."""
