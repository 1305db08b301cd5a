"""The paper's experiments as a whole: what they sweep over, and their tables beside the paper's figures."""
