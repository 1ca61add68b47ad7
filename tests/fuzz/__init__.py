"""The fuzzer: whatever a file holds, it ends in a document or in mistakes that a person can read."""
