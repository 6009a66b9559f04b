"""Values as plain dictionaries, and as tables for pandas, polars and others.

They are not written to files here but in `manytouch.sinks.files`.
"""
