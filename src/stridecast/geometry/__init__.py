"""Pure arrays; knows no body."""
