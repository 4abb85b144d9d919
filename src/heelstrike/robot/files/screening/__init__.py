"""What is made of a robot file before a parser sees it: nothing hostile, everything named."""
