# foretwin without a display, as a user without rights. UNTESTED: written where no container daemon was.
FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
# Software Vulkan, for pictures of the viewer without a display.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends mesa-vulkan-drivers \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 10001 --create-home foretwin \
    && mkdir /drives && chown foretwin /drives
# The versions of the lock, without what is for development.
COPY constraints.txt /tmp/
COPY --from=build /wheels /wheels
RUN grep -o '^[^ #]*==[^ ]*' /tmp/constraints.txt > /tmp/versions.txt \
    && pip install --no-cache-dir --constraint /tmp/versions.txt /wheels/*.whl \
    && rm -r /wheels /tmp/constraints.txt /tmp/versions.txt
USER foretwin
WORKDIR /drives
ENTRYPOINT ["foretwin"]
CMD ["drive", "--view", "none"]
