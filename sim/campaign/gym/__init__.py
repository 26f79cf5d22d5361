"""Encounters as environments of gymnasium, and policies in them."""
