"""What figures share: how they are declared and drawn, their style, and shapes that several of them use."""
