"""Campaigns: scenarios drawn many times, and how near each method comes to the Cramér–Rao bound."""
