"""One page that explains flights."""
