"""`python -m gcs`."""

from gcs.cli import main

main()
