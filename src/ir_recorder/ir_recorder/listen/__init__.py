"""Subscriptions to many topics at once."""
