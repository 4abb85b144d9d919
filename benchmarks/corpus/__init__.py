"""Published robots, fetched from where they are published, loaded and judged by other engines."""
