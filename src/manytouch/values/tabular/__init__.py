"""Values as plain dictionaries, and as tables for pandas, polars and others."""
