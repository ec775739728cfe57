"""A client that somebody wrote who had nothing but docs/protocol.md and docs/bitestream.md: sockets and struct."""
