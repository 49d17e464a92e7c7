"""What happens then: the robot among people, in the paper's scenarios and in random worlds."""
