"""What the verbs that fly share: who has the sticks, the screen, the end of a dive, its files."""
