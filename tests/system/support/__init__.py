"""Real processes for the system tests: a hub, the gimnet tool, and clients made of a socket and struct."""
