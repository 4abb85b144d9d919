"""Motions of several phases, each with contacts of its own: walking, running, standing up."""
