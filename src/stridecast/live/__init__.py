"""The live server: a page in the browser, and other clients, steer characters and crowds (see docs/protocol.md)."""
