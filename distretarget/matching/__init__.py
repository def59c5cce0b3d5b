"""Which source joint drives which target joint."""
