"""Scenes cut from recordings, and the scenarios that replay them."""
