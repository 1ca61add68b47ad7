"""Policies behind alpasim's gRPC service as drivers, `--driver grpc:localhost:50051`; see docs/guide/grpc.md."""
