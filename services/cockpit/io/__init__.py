"""The web server of the cockpit: files and WebSockets, on a thread of its own."""
