"""Pictures of robots and runs in space: figures, portraits, animations, pages."""
