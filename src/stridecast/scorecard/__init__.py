"""Measures: how well crowds walk and how well bodies move."""
