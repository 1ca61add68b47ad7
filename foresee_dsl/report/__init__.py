"""What people read: reports for terminals, browsers and build servers, pictures and playbacks."""
