"""What the program is measured against: general solvers, modal analysis."""
