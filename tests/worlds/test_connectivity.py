import networkx as nx
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.worlds.connectivity import connected_parts

NAMES = [f"r{n}" for n in range(7)]
side = st.sampled_from([*NAMES, None])


@given(st.permutations(NAMES), st.lists(st.tuples(side, side), max_size=8))
def test_parts_are_the_connected_components_in_the_order_of_their_first_rooms(
    names: list[str], sides: list[tuple[str | None, str | None]]
) -> None:
    graph = nx.Graph()
    graph.add_nodes_from(names)
    graph.add_edges_from((a, b) for a, b in sides if a is not None and b is not None)
    parts = connected_parts(names, sides)
    assert sorted(map(sorted, parts)) == sorted(map(sorted, nx.connected_components(graph)))
    firsts = [min(part, key=names.index) for part in parts]
    assert firsts == sorted(firsts, key=names.index)
