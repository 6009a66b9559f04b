"""Started by `manytouch.sinks.output_process.process`."""

from manytouch.sinks.output_process.worker import main

if __name__ == "__main__":
    main()
