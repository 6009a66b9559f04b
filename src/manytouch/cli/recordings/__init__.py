"""The commands about recordings themselves: check, repair, export."""
