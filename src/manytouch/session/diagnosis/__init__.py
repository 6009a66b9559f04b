"""Diagnosis of the installation, of a camera and of a recording, as lines of text with remedies.

Nothing in here runs a session or changes one.
"""
