"""Outputs to other programs in a process of their own, where they do not keep the interpreter from a session.

`process.start_outputs` starts it. The session only appends a reading to a bounded queue; a thread packs it
once for all outputs (`messages`) and sends it; `worker` opens the outputs there and publishes. A process that
has died is started again, and what it had not sent is counted as dropped.
"""
