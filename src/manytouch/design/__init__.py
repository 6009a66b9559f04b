"""From wishes to a sensor, its predicted accuracy and its printable parts."""
