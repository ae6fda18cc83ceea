# The nodes on the demo map in the official image of ROS 2 Jazzy:
#   docker build -t llm-astar . && docker run --rm llm-astar
FROM ros:jazzy-ros-base

SHELL ["/bin/bash", "-o", "pipefail", "-c"]

# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends make python3-venv \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /llm-astar
COPY . .
# make uses the ROS that is sourced, and compiles the searches.
RUN . /opt/ros/jazzy/setup.bash && make install

ENV PATH=/llm-astar/.venv/bin:$PATH
# The image's entry point sources ROS.
CMD ["llm-astar", "run"]
