"""From many analyses to groups, a transition graph and one frozen database."""
