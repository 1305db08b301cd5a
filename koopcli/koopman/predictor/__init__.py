"""What a fit gives: lift, dynamics, output, and where the data lie."""
