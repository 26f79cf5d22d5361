"""The process that a stream runs in: its priority, watchdog, output, requests and times."""
