"""What commands share: exit codes and errors, options, the choice of test cases, the forms of their answers."""
