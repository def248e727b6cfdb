"""All of them, one after another: `make bench`."""

from tests.benchmarks import controller, flight_loop, recording, start_up

for benchmark in (start_up, controller, flight_loop, recording):
    benchmark.main()
    print()
